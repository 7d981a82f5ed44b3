"""The thesis' estimator as printed, selected by its name in `shape_estimator`."""
