"""What a run leaves: traces, tables in files, figures of merit."""
