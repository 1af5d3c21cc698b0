"""The field's failure book: public failures, each as a scenario on the twin."""
