"""A room in which a class predicts together: vote, discuss, vote again, and then see who was right.

`store` keeps a room in one SQLite file and decides every vote. `shown` says what each page may know of it, `server`
answers browsers, `hub` does so under a JupyterHub, and `membership` is the way from a notebook into a room. The pages
are in `pages/`. No name, no address and no time of a vote is kept anywhere.

The method is peer instruction: C. H. Crouch and E. Mazur, Peer Instruction: Ten years of experience and results,
American Journal of Physics 69 (2001), 970–977.
"""
