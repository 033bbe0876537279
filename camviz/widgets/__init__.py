"""What you can touch: widgets bind controls to views and questions; they hold no mathematics and no drawing."""
