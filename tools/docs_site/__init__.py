"""The site (`make docs`): pages written from the code, and what MkDocs needs to build without a network.

hooks.py             adds the generated pages and the pages of the project's root
generated.py         the reference: Python, command line, terms, faults, sources, methods, schemas, error messages
imports_picture.py   the picture of the packages, from their imports
docstring_text.py    docstrings as Markdown
griffe_docstrings.py the same for the pages that mkdocstrings makes
math_fence.py        equations as SVG
check_links.py       every link and picture of the built site leads to something
"""
