"""Reads a figure as PDF with PDFium, and compares it with the same figure as SVG.

    pip install -r requirements.txt
    python check_figure.py FIGURE.pdf FIGURE.svg

The PDF must have one page of the SVG's size, with every word of the SVG as text in an embedded font, an image for each
of the SVG's, and something drawn. Exit code 0 if all is well, 1 with what differs if not.
"""

import re
import sys
from xml.etree import ElementTree

import pypdfium2 as pdfium
import pypdfium2.raw as raw

SVG = "{http://www.w3.org/2000/svg}"


def letters(text):
    """Without spaces, which a PDF has only by its places."""
    return re.sub(r"\s", "", text)


def main(pdf_path, svg_path):
    drawing = ElementTree.parse(svg_path).getroot()
    document = pdfium.PdfDocument(pdf_path)
    assert len(document) == 1, f"{len(document)} pages"
    page = document[0]
    expected = [float(drawing.get(side).removesuffix("pt")) for side in ("width", "height")]
    assert all(abs(a - b) < 0.02 for a, b in zip(page.get_size(), expected)), f"{page.get_size()} is not {expected}"

    found = letters(page.get_textpage().get_text_range())
    for element in drawing.iter(f"{SVG}text"):
        # what reads upwards comes letter by letter, in an order of its own
        word = letters("".join(element.itertext()))
        assert word in found or element.get("transform"), f"{word!r} is not in {found!r}"

    objects = list(page.get_objects())
    texts = [o for o in objects if o.type == raw.FPDF_PAGEOBJ_TEXT]
    assert texts, "there is no text"
    assert all(raw.FPDFFont_GetIsEmbedded(raw.FPDFTextObj_GetFont(text)) == 1 for text in texts), "a font is missing"
    images = sum(o.type == raw.FPDF_PAGEOBJ_IMAGE for o in objects)
    assert images == len(list(drawing.iter(f"{SVG}image"))), f"{images} images"

    pixels = page.render(scale=1, grayscale=True).to_numpy()
    assert 0.001 < (pixels < 250).mean() < 0.9, "nothing is drawn, or everything is black"


try:
    main(*sys.argv[1:])
except AssertionError as error:
    sys.exit(f"{sys.argv[1]}: {error}")
