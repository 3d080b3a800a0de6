"""Scenes whose truth is known, and photographs of them."""
