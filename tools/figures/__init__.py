"""Numbers in README.md and docs/*.md, written from results by one command (`make figures`).

store.py    what the pages quote, kept in docs/figures/*.json
collect.py  results of commands -> docs/figures/*.json, as docs/figures/*.toml says
text.py     marks in the pages -> text
tables.py   tables of the pages
numbers.py  numbers in the text that no table beside them has
"""
