"""Elements of XML whose numbers read back to the same floats: MJCF and URDF."""

from collections.abc import Iterable
from xml.etree.ElementTree import Element, SubElement, indent, tostring

Attribute = str | float | Iterable[float]


def add(parent: Element, tag: str, **attributes: Attribute) -> Element:
    """A child with these attributes, numbers and lists of numbers among them; one that is '' is left out."""
    return SubElement(parent, tag, {key: shown for key, value in attributes.items() if (shown := written(value))})


def written(value: Attribute) -> str:
    """An attribute as text."""
    if isinstance(value, str):
        return value
    return " ".join(repr(float(one)) for one in ([value] if isinstance(value, int | float) else value))


def text(root: Element) -> str:
    """The whole tree, indented."""
    indent(root)
    return tostring(root, encoding="unicode")
