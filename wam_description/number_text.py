"""Numbers as messages write them."""


def brief(value: float) -> str:
    """A number to two digits, without an exponent from 1e-4 to 1e10: 0.0042, 7.1, 120."""
    return f"{float(f'{value:.2g}'):.10g}"
