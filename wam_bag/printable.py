"""Text from outside made fit for a terminal and a log: bounded, and without control characters."""


def printable(text: str, longest: int | None = None, kept: str = "") -> str:
    r"""A text whose control characters are shown, as ``\x1b``, and not sent.

    Parameters
    ----------
    text : from outside: a name or value of a message, a bag or a file.
    longest : characters that are kept, about; the middle of a longer text is left out.  None keeps all.
    kept : characters that are sent all the same, as line feeds.
    """
    if longest is not None and len(text) > longest:
        half = longest // 2
        text = f"{text[:half]}[{len(text) - 2 * half} more characters]{text[-half:]}"
    if text.isprintable():
        return text
    return "".join(one if one.isprintable() or one in kept else ascii(one)[1:-1] for one in text)
