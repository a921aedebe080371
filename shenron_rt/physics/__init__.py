"""Physics as functions of arrays: no files, no Mitsuba."""
