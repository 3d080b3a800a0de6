"""The JSON files of this project and their schema."""
