"""Make a page of `seakeep check` small enough to keep beside an example.

    python ../keep_page.py check

puts PNG pictures in place of SVG ones, and removes the SVG and LaTeX files with the links to them.
"""

import base64
import re
import sys
from pathlib import Path

folder = Path(sys.argv[1])


def picture(found):
    png = folder / "figures" / f"{found[2]}.png"
    data = base64.b64encode(png.read_bytes()).decode()
    return f'{found[1]}<img alt="{found[2]}" width="100%" src="data:image/png;base64,{data}">'


page = folder / "report.html"
text = page.read_text(encoding="utf-8")
text = re.sub(r'(<figure id="figure-([\w-]+)">\s*)<svg.*?</svg>', picture, text, flags=re.S)
text = re.sub(r', <a href="[^"]*\.(svg|tex)">\w+</a>', "", text)
page.write_text(text, encoding="utf-8")
for path in (*folder.glob("figures/*.svg"), *folder.glob("tables/*.tex")):
    path.unlink()
