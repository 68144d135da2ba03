"""How a measured number is written beside its limit."""


def told_apart(value: float, limit: float) -> tuple[str, str]:
    """Write both with four digits, or as many as show on which side of the limit the value is."""
    for digits in range(4, 18):
        words = f"{value:.{digits}g}", f"{limit:.{digits}g}"
        if (float(words[0]) > float(words[1])) == (value > limit):
            break
    return words
