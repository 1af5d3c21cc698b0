"""What is moved: the bench, any cable, the suit on an arm."""
