"""The thesis' estimator, as printed; chosen by its name in `shape_estimator`."""
