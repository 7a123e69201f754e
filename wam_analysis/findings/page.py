"""An analysis as one self-contained page of HTML."""

import base64
import html
from collections.abc import Iterable, Sequence

from wam_analysis.findings.analysis import Analysis
from wam_analysis.findings.finding import Finding, Section, shown
from wam_analysis.findings.plots import Plot, plots
from wam_bag.losses import PARAMETERS

NARROW = 640  # px; up to this width the narrow pictures are shown

# no network access, whatever is in the bag
POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'"
CSS = """
:root { color-scheme: light; }
* { box-sizing: border-box; }
body { margin: 0; background: #f4f5f7; color: #1d2126; font: 16px/1.5 system-ui, "DejaVu Sans", sans-serif; }
main { max-width: 980px; margin: 0 auto; padding: 0 16px 48px; }
header { background: #22303c; color: #fff; padding: 20px 16px; }
header div { max-width: 948px; margin: 0 auto; }
h1 { font-size: 1.4rem; margin: 0; overflow-wrap: anywhere; }
header p { margin: 4px 0 0; color: #c9d3dc; }
nav { display: flex; flex-wrap: wrap; gap: 6px 14px; margin: 14px 0; }
nav a { color: #00568c; }
section { background: #fff; border-radius: 8px; padding: 4px 20px 16px; margin: 16px 0; }
h2 { font-size: 1.15rem; margin: 14px 0 6px; }
p, li, td, th { overflow-wrap: anywhere; }
ul { margin: 0; padding-left: 20px; }
figure { margin: 16px 0 8px; }
figure img { display: block; width: 100%; height: auto; }
figure.arm img { max-width: 640px; margin: 0 auto; }
figcaption { color: #59636e; font-size: 0.875rem; }
table { width: 100%; border-collapse: collapse; margin: 12px 0 0; font-size: 0.9rem; table-layout: fixed; }
th { text-align: left; font-weight: 600; border-bottom: 2px solid #d5dae0; }
td { border-bottom: 1px solid #e6e8eb; vertical-align: top; }
th, td { padding: 4px 6px 4px 0; }
th:nth-child(n+2), td.number { text-align: right; width: 24%; font-variant-numeric: tabular-nums; }
small, .lacking { color: #59636e; }
summary { cursor: pointer; margin-top: 12px; color: #00568c; }
pre { white-space: pre-wrap; overflow-wrap: anywhere; font-size: 0.8rem; }
dl { display: grid; grid-template-columns: minmax(7em, 30%) 1fr; gap: 4px 12px; margin: 0; font-size: 0.9rem; }
dt { color: #59636e; } dd { margin: 0; overflow-wrap: anywhere; }
@media (max-width: 640px) {
  body { font-size: 15px; }
  main { padding: 0 8px 32px; }
  section { padding: 2px 12px 12px; }
  table { font-size: 0.82rem; }
  th:nth-child(n+2), td.number { width: 27%; }
  dl { display: block; } dd { margin: 0 0 6px; }
}
"""


def page(analysis: Analysis) -> str:
    """The whole page.

    Parameters
    ----------
    analysis : of a bag.

    Returns
    -------
    str
        HTML with its styles and pictures; it has no script and makes no request.
    """
    pictures = list(plots(analysis))
    name = analysis.recording.bag.path.name
    sections = "".join(_section(section, pictures) for section in analysis.sections)
    links = "".join(
        f'<a href="#{key}">{html.escape(title)}</a>'
        for key, title in [*((s.key, s.title) for s in analysis.sections), ("provenance", "Provenance")]
    )
    return (
        "<!doctype html>\n"
        '<html lang="en"><head><meta charset="utf-8">'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{html.escape(name)}: analysis</title><style>{CSS}</style></head><body>"
        f"<header><div><h1>{html.escape(name)}</h1><p>{html.escape(_lead(analysis))}</p></div></header>"
        f"<main><nav>{links}</nav>{sections}{_provenance(analysis)}{_parameters(analysis)}</main></body></html>\n"
    )


def _lead(analysis: Analysis) -> str:
    return f"{analysis.recording.summary.namespace or '/'}, {shown(analysis.duration, 's')}, {analysis.recording.mode}"


def _section(section: Section, pictures: Iterable[Plot]) -> str:
    sentences = "".join(f"<li>{html.escape(sentence)}</li>" for sentence in section.sentences)
    figures = "".join(_figure(picture) for picture in pictures if picture.section == section.key)
    lacking = ""
    if section.lacking:
        lacking = f'<p class="lacking"><small>Not in this bag: {html.escape(", ".join(section.lacking))}.</small></p>'
    return (
        f'<section id="{section.key}"><h2>{html.escape(section.title)}</h2><ul>{sentences}</ul>{figures}'
        f"{_table(section.findings)}{lacking}</section>"
    )


def _figure(picture: Plot) -> str:
    wide, narrow = (
        f"data:image/{picture.kind};base64,{base64.b64encode(data).decode()}" for data in (picture.wide, picture.narrow)
    )
    text = html.escape(picture.title)
    image = f'<img alt="{text}" src="{wide}">'
    if picture.wide != picture.narrow:
        image = f'<picture><source media="(max-width: {NARROW}px)" srcset="{narrow}">{image}</picture>'
    kind = ' class="arm"' if picture.kind == "png" else ""
    return f"<figure{kind}>{image}<figcaption>{text}</figcaption></figure>"


def _table(findings: Sequence[Finding]) -> str:
    if not findings:
        return ""
    rows = "".join(
        f"<tr><td>{html.escape(finding.name)}{_note(finding)}</td>"
        f'<td class="number">{html.escape(shown(finding.measured, finding.unit))}</td>'
        f'<td class="number">{html.escape(shown(finding.predicted, finding.unit))}</td></tr>'
        for finding in findings
    )
    head = "".join(f"<th>{title}</th>" for title in ("Quantity", "Measured", "Predicted"))
    return f"<table><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table>"


def _note(finding: Finding) -> str:
    return f"<br><small>{html.escape(finding.note)}</small>" if finding.note else ""


def _provenance(analysis: Analysis) -> str:
    rows = "".join(f"<dt>{html.escape(k)}</dt><dd>{html.escape(v)}</dd>" for k, v in analysis.provenance.items())
    topics = "".join(
        f"<dt>{html.escape(name)}</dt><dd>{len(columns.log_time_ns)}</dd>"
        for name, columns in sorted(analysis.recording.bag.topics.items())
    )
    notes = "".join(f"<li>{html.escape(note)}</li>" for note in analysis.recording.summary.notes)
    return (
        f'<section id="provenance"><h2>Provenance</h2><dl>{rows}</dl><ul>{notes}</ul>'
        f"<details><summary>Messages of each topic that was read</summary><dl>{topics}</dl></details></section>"
    )


def _parameters(analysis: Analysis) -> str:
    attached = analysis.recording.bag.attachments.get(PARAMETERS)
    if attached is None:
        return '<section id="parameters"><h2>Parameters</h2><p>No parameters in the bag.</p></section>'
    text = attached.decode("utf-8", "replace")
    return (
        '<section id="parameters"><h2>Parameters</h2><p>As recorded, of every node.</p>'
        f"<details><summary>Show all</summary><pre>{html.escape(text)}</pre></details></section>"
    )
