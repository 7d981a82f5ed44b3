"""Methods of the thesis as printed, and corrected: chosen by name, imported by no product code."""
