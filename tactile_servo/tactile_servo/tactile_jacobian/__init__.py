"""Tactile Jacobian: the change of image features with the contact (chapter 6, appendix C)."""
