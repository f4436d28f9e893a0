"""Style of the page: colours, and a layout for the width of a phone."""

from __future__ import annotations

#: Colour from which viser makes its scale: its buttons then have the blue of the charts, with white text.
BRAND = (0, 54, 84)
#: Colour of buttons of second rank.
QUIET = (214, 230, 240)
#: Labels that are easier to read, and on a phone a sheet as wide as the screen. viser marks its sheet only by its sizes.
CSS = """<style>
:root[data-mantine-color-scheme="light"] { --mantine-color-dimmed: #475059; }
@media (max-width: 36em) {
  div[style*="width: 20em"] { width: 100% !important; }
  div[style*="max-height: 60%"] { max-height: 55% !important; }
}
</style>"""
HINT = (
    CSS + '<div data-key="hint" style="padding:.5em .8em .3em;font-size:14px"><b>Drag the rover</b> over the terrain: it settles '
    "as you drag. <b>Drag the yellow ring</b> to turn it. The tab <b>Rover</b> changes its links.</div>"
)
#: Note in a browser that draws on the processor.
SOFTWARE = (
    "This browser draws without a graphics card (see its setting of hardware acceleration): light drawing is on (tab Terrain), "
    "and a moving picture is coarser."
)


def note_html(text: str, key: str = "", warning: bool = False) -> str:
    """Return a small line of text as HTML.

    Args:
        text: plain text.
        key: attribute `data-key` of the line.
        warning: in the colour of warnings.

    Returns:
        The line; empty without text.
    """
    from html import escape

    colour = "color:#b35900" if warning else "opacity:.85"
    return f'<div data-key="{key}" style="padding:0 .8em .4em;font-size:12px;{colour}">{escape(text)}</div>' if text else ""
