"""What the contact benchmark compares: our estimators, the thesis', and their peers."""
