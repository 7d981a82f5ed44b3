"""Tables of the contact benchmark, as Markdown."""

from benchmarks.contact.tables.accuracy import everything

__all__ = ['everything']
