"""What ``import bowden`` offers: the functions of everyday work, a file each; the commands call the same."""
