"""Pictures of the contact benchmark."""

from benchmarks.contact.charts.accuracy import draw

__all__ = ['draw']
