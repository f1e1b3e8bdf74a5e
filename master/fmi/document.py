"""Documentation page and icon of an exported FMU, made from its model description."""

from __future__ import annotations

import html
import re
import struct
import zlib
from xml.etree.ElementTree import Element

import numpy as np

_ICON = 96  # pixels


def page_html(model: Element, about: str) -> str:
    """One page: what the model is, `about` it in HTML, its input and output ports (vectors in one row), its parameters with defaults."""
    title, text = model.get("modelName", ""), model.get("description", "")
    facts = " · ".join(f"{key} {model.get(key)}" for key in ("version", "author", "license") if model.get(key))
    parts = [
        f"<!DOCTYPE html><html><head><meta charset='utf-8'><title>{html.escape(title)}</title>",
        "<style>body{font-family:sans-serif;max-width:60em}td,th{text-align:left;padding:.1em 1em .1em 0}</style>",
        f"</head><body><h1>{html.escape(title)}</h1><p>{html.escape(text)}</p><p>{html.escape(facts)}</p>",
        about,
    ]
    for causality, heading in (("input", "Inputs"), ("output", "Outputs"), ("parameter", "Parameters")):
        cells = [_row(*row) for row in _ports(model, causality)]
        head = "<tr><th>name</th><th>size</th><th>unit</th><th>default</th><th>meaning</th></tr>"
        parts.append(f"<h2>{heading}</h2><table>{head}{''.join(cells)}</table>")
    return "\n".join([*parts, "</body></html>"])


def icon_png() -> bytes:
    """A pipe hanging from a vessel to the bed: 96 x 96 pixels, PNG."""
    y, x = np.mgrid[0:_ICON, 0:_ICON].astype(float)
    image = np.full((_ICON, _ICON, 3), 255, dtype=np.uint8)
    image[y > 30] = (214, 232, 244)
    image[y > 86] = (196, 176, 140)
    bed, curve = 84.0, 9.0  # the catenary y = bed - a (cosh((x - x0) / a) - 1), tangent to the bed
    span = np.maximum(x - 26.0, 0.0) / curve
    height = curve * (np.cosh(np.minimum(span, 4.0)) - 1.0)
    slope = np.sqrt(1.0 + np.sinh(np.minimum(span, 4.0)) ** 2)
    image[(np.abs(bed - height - y) < 2.0 * slope) & (y > 30) & (y <= 86) & (x < 54)] = (208, 92, 32)
    hull = (y > 20) & (y < 34) & (x > 34 + (y - 20) / 2) & (x < 88 - (y - 20))
    image[hull | ((y > 8) & (y <= 20) & (x > 66) & (x < 78))] = (40, 60, 84)
    rows = b"".join(b"\0" + row.tobytes() for row in image)
    header = struct.pack(">IIBBBBB", _ICON, _ICON, 8, 2, 0, 0, 0)
    chunks = ((b"IHDR", header), (b"IDAT", zlib.compress(rows, 9)), (b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(_chunk(*chunk) for chunk in chunks)


def _chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def _ports(model: Element, causality: str) -> list[list[str]]:
    """Rows (name, size, unit, default, meaning) of all variables of one causality; ``x[1]``.. share a row."""
    rows: dict[str, list[str]] = {}
    units: dict[str, dict[str, None]] = {}  # of a port's components, each once
    items = {(kind.get("name"), item.get("value")): item.get("name", "") for kind in model.iter("SimpleType") for item in kind.iter("Item")}
    for variable in model.iterfind("ModelVariables/ScalarVariable"):
        if variable.get("causality") != causality:
            continue
        name = re.sub(r"\[\d+\]$", "", variable.get("name", ""))
        value = variable[0].get("start", "")
        value = items.get((variable[0].get("declaredType"), value), value)
        units.setdefault(name, {})[variable[0].get("unit", "")] = None
        if name in rows:
            rows[name][1] = str(int(rows[name][1]) + 1)
            rows[name][3] += f", {value}" if value else ""
        else:
            rows[name] = [name, "1", "", value, variable.get("description", "")]
    for name, row in rows.items():
        row[2] = ", ".join(units[name])
        if causality == "input" and not any(map(float, row[3].split(", "))):
            row[3] = ""  # zero goes without saying
    return list(rows.values())


def _row(*cells: str) -> str:
    return "<tr>" + "".join(f"<td>{html.escape(cell)}</td>" for cell in cells) + "</tr>"
