"""Methods of the thesis, with corrections; chosen by name, not imported by product code."""
