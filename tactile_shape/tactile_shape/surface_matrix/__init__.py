"""The thesis' surface matrix and its estimator (chapter 4)."""
