"""The subcommands of `camviz`, one module each: `add` describes it to the parser, and a function does the work."""
