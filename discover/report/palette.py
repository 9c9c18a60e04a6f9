"""Colours of pages and pictures, in light and in dark.

Okabe & Ito 2008 for what has a meaning: told apart with every common colour blindness. In the dark
the same hues, lighter. No meaning hangs on colour alone: curves differ in dashes too, map cells
carry their number or sign.
"""

COLOURS = {
    "paper": ("#ffffff", "#16181b"),
    "ink": ("#1c1d1f", "#e8e9eb"),
    "soft": ("#5a5d63", "#a5a9b0"),
    "line": ("#d8dadd", "#3a3e44"),
    "card": ("#f5f6f7", "#1f2226"),
    "accent": ("#0072b2", "#56b4e9"),
    "truth": ("#1c1d1f", "#f2f3f5"),
    "before": ("#75787e", "#949aa2"),
    "sparse": ("#d55e00", "#ff8b3d"),
    "network": ("#0072b2", "#56b4e9"),
    "measured": ("#6b6e74", "#9da2aa"),
    "green": ("#009e73", "#2fc79c"),
    "purple": ("#b5558d", "#e39cc5"),
    "yellow": ("#b87f00", "#f0b840"),
    "grid": ("#e2e4e7", "#33373d"),
    "shade": ("#eef0f2", "#2c3138"),
}
"""Name of the CSS variable, without dashes → its value in light and in dark."""


def style_sheet() -> str:
    """Return the CSS that sets every colour, and changes it where a reader prefers the dark."""
    light, dark = (
        " ".join(f"--{name}:{pair[i]};" for name, pair in COLOURS.items()) for i in range(2)
    )
    # what is printed is printed on white, whatever the screen
    return (
        f":root {{ {light} }}\n"
        f"@media screen and (prefers-color-scheme: dark) {{ :root {{ {dark} }} }}"
    )
