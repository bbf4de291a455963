"""Settings of the documentation site; tools/docs builds it."""
import re
from pathlib import Path

TOP = Path(__file__).resolve().parent.parent

project = "msim"
author = "the msim developers"
version = release = re.search(r"project\(msim\s+VERSION ([\d.]+)",
                              (TOP / "CMakeLists.txt").read_text()).group(1)

extensions = ["myst_parser", "breathe"]
myst_heading_anchors = 3
breathe_projects = {"msim": str(TOP / "build" / "docs" / "doxygen" / "xml")}
breathe_default_project = "msim"
breathe_domain_by_extension = {"h": "c"}
breathe_order_parameters_first = False
primary_domain = "c"
html_theme = "furo"
html_title = f"msim {version}"
