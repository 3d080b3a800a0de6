"""What tests share: laws, scenes, boards, real photographs, and the check of shapes in annotations."""

from helpers import shapes as shapes
