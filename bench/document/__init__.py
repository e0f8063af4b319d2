"""One tree of paragraphs, tables and pictures, written as Markdown or HTML."""
