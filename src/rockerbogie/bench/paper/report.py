"""Report of a reproduction: one self-contained HTML page with embedded pictures."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path

from .claims import Claim


@dataclass(frozen=True)
class Picture:
    """Image file with its description for the blind (alt text) and its caption."""

    file: Path
    alt: str
    caption: str


@dataclass(frozen=True)
class ErrorRow:
    """Difference of model and simulation in one channel, with its limits; None means no limit."""

    channel: str
    unit: str
    rms: float
    worst: float
    rms_limit: float | None
    worst_limit: float | None

    @property
    def within(self) -> bool:
        """True if neither error exceeds its limit."""
        pairs = ((self.rms, self.rms_limit), (self.worst, self.worst_limit))
        return all(limit is None or value <= limit for value, limit in pairs)


def write_report(
    file: Path,
    *,
    lead: str,
    errors: Sequence[ErrorRow],
    claims: Sequence[tuple[Claim, Claim]],
    pictures: Sequence[Picture],
    facts: Mapping[str, str],
    data: Mapping[str, str],
) -> None:
    """Write the report page.

    Args:
        file: the HTML file, overwritten.
        lead: one or two sentences on what was done.
        errors: one row per channel.
        claims: each statement decided from the model's run and from the simulation's; empty if the paper's do not apply.
        pictures: .png or .gif files, in the order of the page.
        facts: name → value: rover, terrain, versions.
        data: name of a file beside the page → its content.

    Raises:
        OSError: the file cannot be written, or a picture cannot be read.
    """
    kept = sum(row.within for row in errors)
    held = sum(model.holds for model, _ in claims)
    body = [
        "<h1>A rocker-bogie over two kinds of hill</h1>",
        f"<p class=lead>{escape(lead)}</p>",
        "<p class=verdict>",
        _badge(kept == len(errors), f"{kept} of {len(errors)} error limits met") if claims else "",
        _badge(held == len(claims), f"{held} of {len(claims)} statements of the paper confirmed") if claims else "",
        "</p>",
        *(_figure(picture) for picture in pictures),
        "<h2>Kinematic model against rigid-body simulation</h2>",
        "<p>Differences at equal position and yaw (x, y, yaw), over the whole crossing.</p>",
        _errors_table(errors),
        "<h2>Statements of the paper on its figures</h2>",
        "<p>Each statement is paraphrased and decided by code from the numbers of each run. The numbers given are the "
        "model's, and also the simulation's where its verdict differs.</p>",
        _claims_table(claims) if claims else "",
        "<h2>Settings and versions</h2>",
        "<dl>" + "".join(f"<dt>{escape(k)}</dt><dd>{escape(v)}</dd>" for k, v in facts.items()) + "</dl>",
        "<h2>Data</h2>",
        "<dl>"
        + "".join(f'<dt><a href="{escape(k)}">{escape(k)}</a></dt><dd>{escape(v)}</dd>' for k, v in data.items())
        + "</dl>",
    ]
    file.write_text(_PAGE.replace("@BODY@", "\n".join(body)), encoding="utf-8")


def _figure(picture: Picture) -> str:
    """Return the HTML of a picture, with the file's content embedded, and its caption."""
    kind = {".png": "image/png", ".gif": "image/gif"}[picture.file.suffix]
    content = base64.b64encode(picture.file.read_bytes()).decode("ascii")
    return (
        f'<figure><img src="data:{kind};base64,{content}" alt="{escape(picture.alt)}">'
        f"<figcaption>{escape(picture.caption)}</figcaption></figure>"
    )


def _errors_table(errors: Sequence[ErrorRow]) -> str:
    """Return the HTML table of errors, one row per channel."""
    rows = [
        f"<tr><th scope=row>{escape(e.channel)}</th><td>{e.rms:.4f}</td><td>{_limit(e.rms_limit)}</td>"
        f"<td>{e.worst:.4f}</td><td>{_limit(e.worst_limit)}</td><td>{escape(e.unit)}</td>"
        f"<td>{_badge(e.within, 'within' if e.within else 'beyond') if e.rms_limit else ''}</td></tr>"
        for e in errors
    ]
    heads = "".join(f"<th scope=col>{h}</th>" for h in ("channel", "RMS", "limit", "worst", "limit", "unit", ""))
    return f"<div class=wide><table class=numbers><thead><tr>{heads}</tr></thead><tbody>{''.join(rows)}</tbody></table></div>"


def _limit(value: float | None) -> str:
    """Return a limit as text; a dash for None."""
    return "–" if value is None else f"{value:g}"


def _claims_table(claims: Sequence[tuple[Claim, Claim]]) -> str:
    """Return the HTML table of claims, each decided for the model and for the simulation."""
    rows = []
    for model, sim in claims:
        because = model.because if model.holds == sim.holds else f"{model.because} In the simulation: {sim.because}"
        rows.append(
            f"<tr><td>{model.figure}</td><td><strong>{escape(model.says)}</strong><br>"
            f"<span class=because>{escape(because)}</span></td><td>{_truth('model', model)} {_truth('simulation', sim)}</td></tr>"
        )
    heads = "".join(f"<th scope=col>{h}</th>" for h in ("fig.", "statement, and the numbers that decide it", "confirmed"))
    return f"<div class=wide><table class=claims><thead><tr>{heads}</tr></thead><tbody>{''.join(rows)}</tbody></table></div>"


def _truth(of: str, claim: Claim) -> str:
    """Return the HTML badge of a claim for the model or the simulation."""
    return _badge(claim.holds, f"{of}: {'true' if claim.holds else 'not true'}")


def _badge(good: bool, text: str) -> str:
    """Return the HTML of a badge with a check mark or a cross."""
    return f'<span class="badge {"good" if good else "bad"}">{"✓" if good else "✗"} {escape(text)}</span>'


_PAGE = """<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>Rocker-bogie: section III reproduced</title>
<style>
:root { color-scheme: light; }
body { margin: 0 auto; max-width: 62rem; padding: 1.5rem 1rem 4rem; background: #fff; color: #222;
  font: 16px/1.55 system-ui, -apple-system, "Segoe UI", Roboto, sans-serif; }
h1 { font-size: 1.7rem; line-height: 1.2; margin: .5rem 0; }
h2 { font-size: 1.2rem; margin: 2.4rem 0 .4rem; border-bottom: 1px solid #ddd; padding-bottom: .2rem; }
p { margin: .5rem 0; max-width: 46rem; }
.lead { font-size: 1.05rem; color: #444; }
figure { margin: 1.8rem 0; }
figure img { display: block; width: 100%; height: auto; }
figcaption { color: #555; font-size: .92rem; margin-top: .4rem; max-width: 46rem; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; width: 100%; font-size: .94rem; }
th, td { text-align: left; padding: .4rem .7rem .4rem 0; border-bottom: 1px solid #e6e6e6; vertical-align: top; }
thead th { color: #555; font-weight: 600; border-bottom: 1px solid #bbb; }
.numbers td { font-variant-numeric: tabular-nums; white-space: nowrap; }
.because { color: #555; }
.claims td:last-child { width: 11rem; }
.badge { display: inline-block; white-space: nowrap; border-radius: .8rem; padding: .05rem .6rem; font-size: .88rem; }
.verdict .badge { margin: .1rem .4rem .1rem 0; font-size: .98rem; padding: .15rem .8rem; }
.good { background: #e3f1ea; color: #0b5b3b; }
.bad { background: #fbe6dc; color: #8a2f00; }
dl { display: grid; grid-template-columns: minmax(7rem, max-content) 1fr; gap: .25rem 1.2rem; }
dt { color: #555; }
dd { margin: 0; }
a { color: #0a5a91; }
@media (max-width: 34rem) {
  body { padding: 1rem .8rem 3rem; }
  h1 { font-size: 1.4rem; }
  .claims thead { display: none; }
  .claims tr, .claims td { display: block; border: 0; padding: .1rem 0; }
  .claims tr { border-bottom: 1px solid #e6e6e6; padding: .7rem 0; }
  .claims td:first-child::before { content: "Figure "; }
  .claims td:last-child { width: auto; }
  dl { grid-template-columns: 1fr; }
  dd { margin-bottom: .5rem; }
}
</style>
</head>
<body>
@BODY@
</body>
</html>
"""
