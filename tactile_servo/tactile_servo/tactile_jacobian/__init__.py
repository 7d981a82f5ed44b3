"""The tactile Jacobian: how features of an image change with the contact (chapter 6, C)."""
