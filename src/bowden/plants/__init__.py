"""Plants: the bench, any cable, the suit on an arm."""
