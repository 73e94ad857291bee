"""Reading and writing of files: pictures, tables, locks and paths."""
