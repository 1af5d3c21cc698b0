"""One file for each law, named as the law is; it ends with its `LAW`. `bowden.control.registry` finds them here."""
