"""An analysis as one self-contained page of HTML."""

import base64
import hashlib
import html
from collections.abc import Iterable, Sequence

from wam_analysis.findings.analysis import Analysis
from wam_analysis.findings.charts import FIRST, SIGNALS, charts, data, scripts
from wam_analysis.findings.finding import Finding, Section
from wam_analysis.findings.plots import arm_plot
from wam_analysis.findings.tabulated import MARK, Table, legends, tabulated
from wam_bag.losses import PARAMETERS

# no network access, whatever is in the bag; only the scripts of this page run
POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src {}"
CSS = """
:root {
  color-scheme: light dark; --ink: #1d2126; --faint: #59636e; --page: #f4f5f7; --sheet: #fff; --line: #e0e3e7;
  --head: #22303c; --link: #00568c; --bad: #b42318;
}
@media (prefers-color-scheme: dark) {
  :root { --ink: #e4e7eb; --faint: #9aa5b1; --page: #14181d; --sheet: #1d232a; --line: #37414c; --head: #0d1116;
    --link: #7cc4f5; --bad: #ff8a7a; }
}
* { box-sizing: border-box; }
body { margin: 0; background: var(--page); color: var(--ink); font: 16px/1.5 system-ui, "DejaVu Sans", sans-serif; }
main { max-width: 980px; margin: 0 auto; padding: 0 16px 48px; }
header { background: var(--head); color: #fff; padding: 20px 16px; }
header div { max-width: 948px; margin: 0 auto; }
h1 { font-size: 1.4rem; margin: 0; overflow-wrap: anywhere; }
header p { margin: 4px 0 0; color: #c9d3dc; }
nav { display: flex; flex-wrap: wrap; gap: 6px 14px; margin: 14px 0; }
nav a { color: var(--link); }
section { background: var(--sheet); border-radius: 8px; padding: 4px 20px 16px; margin: 16px 0; }
#verdict { border-left: 6px solid var(--link); font-size: 1.06rem; }
h2 { font-size: 1.15rem; margin: 14px 0 6px; }
p, li, td, th { overflow-wrap: anywhere; }
ul { margin: 0; padding-left: 20px; }
figure { margin: 16px 0 8px; }
figure img { display: block; width: 100%; height: auto; }
figure.arm img { max-width: 640px; margin: 0 auto; }
.u-legend { color: var(--ink); font-size: 0.8rem; }
figcaption { color: var(--faint); font-size: 0.875rem; }
.wide { overflow-x: auto; }
table.numbers { border-collapse: collapse; margin: 12px 0 0; font-size: 0.9rem; }
.numbers th { text-align: right; vertical-align: bottom; font-weight: 600; border-bottom: 2px solid var(--line); }
.numbers td { border-bottom: 1px solid var(--line); text-align: right; font-variant-numeric: tabular-nums; }
.numbers th, .numbers td { padding: 4px 0 4px 14px; max-width: 11em; overflow-wrap: normal; }
.numbers th:first-child, .numbers td:first-child { text-align: left; padding-left: 0; max-width: 20em; }
.numbers .deviates { color: var(--bad); font-weight: 600; }
small { color: var(--faint); }
summary { cursor: pointer; margin-top: 12px; color: var(--link); }
pre { white-space: pre-wrap; overflow-wrap: anywhere; font-size: 0.8rem; }
dl { display: grid; grid-template-columns: minmax(7em, 30%) 1fr; gap: 4px 12px; margin: 0; font-size: 0.9rem; }
dt { color: var(--faint); } dd { margin: 0; overflow-wrap: anywhere; }
@media (max-width: 640px) {
  body { font-size: 15px; }
  main { padding: 0 8px 32px; }
  section { padding: 2px 12px 12px; }
  table.numbers { font-size: 0.82rem; }
  dl { display: block; } dd { margin: 0 0 6px; }
}
@media print {
  :root { --ink: #000; --faint: #444; --page: #fff; --sheet: #fff; --line: #bbb; --head: #fff; --link: #000; }
  header, header p { color: #000; }
  nav { display: none; }
  section, figure, tr { break-inside: avoid; }
  .wide { overflow: visible; }
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
        HTML with its styles, scripts and pictures; it makes no request.
    """
    drawn = list(charts(analysis))
    figures = []
    for i, chart in enumerate(drawn):
        text = f"{html.escape(chart.title)} Drag to zoom, double click to see all."
        drawing = f'<figure class="chart" data-chart="{i}"><div></div><figcaption>{text}</figcaption></figure>'
        figures.append((chart.section, drawing))
    if (arm := arm_plot(analysis.recording)) is not None:
        text, picture = html.escape(arm[0]), f"data:image/svg+xml;base64,{base64.b64encode(arm[1]).decode()}"
        drawing = f'<figure class="arm"><img alt="{text}" src="{picture}"><figcaption>{text}</figcaption></figure>'
        figures.insert(0, (FIRST, drawing))
    name = analysis.recording.bag.path.name
    last = Section(SIGNALS, "Signals", (), ())
    shown_last = any(section == SIGNALS for section, _ in figures)
    sections = "".join(_section(section, figures) for section in (*analysis.sections, *([last] * shown_last)))
    links = "".join(
        f'<a href="#{key}">{html.escape(title)}</a>'
        for key, title in [*((s.key, s.title) for s in analysis.sections), ("provenance", "Provenance")]
    )
    library, script, styles = scripts()
    run = (library, script) if drawn else ()
    digests = (base64.b64encode(hashlib.sha256(text.encode()).digest()).decode() for text in run)
    allowed = " ".join(f"'sha256-{digest}'" for digest in digests) or "'none'"
    return (
        "<!doctype html>\n"
        '<html lang="en"><head><meta charset="utf-8">'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY.format(allowed)}">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{html.escape(name)}: analysis</title><style>{styles}{CSS}</style></head><body>"
        f"<header><div><h1>{html.escape(name)}</h1><p>{html.escape(analysis.sections[0].sentences[0])}</p></div></header>"
        f"<main><nav>{links}</nav>{sections}{_provenance(analysis)}{_parameters(analysis)}</main>"
        f'<script type="application/json" id="charts">{data(drawn)}</script>'
        f"{''.join(f'<script>{text}</script>' for text in run)}</body></html>\n"
    )


def _section(section: Section, drawn: Sequence[tuple[str, str]]) -> str:
    sentences = "".join(f"<li>{html.escape(sentence)}</li>" for sentence in section.sentences)
    figures = "".join(figure for key, figure in drawn if key == section.key)
    numbers = tabulated(section.findings)
    tables = "".join([*(f"<p><small>{text}.</small></p>" for text in legends(numbers)), *map(_table, numbers)])
    return (
        f'<section id="{section.key}"><h2>{html.escape(section.title)}</h2><ul>{sentences}</ul>'
        f"{tables}{_notes(section.findings)}{figures}</section>"
    )


def _table(table: Table) -> str:
    head = "".join(f"<th>{html.escape(title)}</th>" for title in table[0])
    rows = "".join(f"<tr>{''.join(map(_cell, row))}</tr>" for row in table[1:])
    return f'<div class="wide"><table class="numbers"><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table></div>'


def _cell(text: str) -> str:
    return f"<td{' class=deviates' * (MARK in text)}>{html.escape(text)}</td>"


def _notes(findings: Sequence[Finding]) -> str:
    noted = [one for one in findings if one.note]
    if not noted:
        return ""
    rows = _pairs((one.name, one.note) for one in noted)
    return f"<details><summary>Where the numbers come from</summary>{rows}</details>"


def _pairs(rows: Iterable[tuple[str, str]]) -> str:
    """A list of names, each with what belongs to it."""
    return f"<dl>{''.join(f'<dt>{html.escape(name)}</dt><dd>{html.escape(text)}</dd>' for name, text in rows)}</dl>"


def _provenance(analysis: Analysis) -> str:
    topics = sorted(analysis.recording.bag.topics.items())
    counts = _pairs((name, str(len(columns.log_time_ns))) for name, columns in topics)
    return (
        f'<section id="provenance"><h2>Provenance</h2>{_pairs(analysis.provenance.items())}'
        f"<details><summary>Messages of each topic that was read</summary>{counts}</details></section>"
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
