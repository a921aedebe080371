"""Files: atomic writes, arrays, captures of boards."""
