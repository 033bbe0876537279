"""What `camviz` does for learners and teachers, one module each; `listed` names them for the command line."""
