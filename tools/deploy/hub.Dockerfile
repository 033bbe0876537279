# One student's container on a hub: the image of the Dockerfile beside this one, and what a hub starts in it. From the
# repository's folder, after `docker build -t camviz -f tools/deploy/Dockerfile .`:
#     docker build -t registry.example.org/camviz-hub:0.1.0 -f tools/deploy/hub.Dockerfile .
FROM camviz

USER root
# The hub of chart 4.4.0 is JupyterHub 5.5, and a student's server has to be of the same major version.
# nbgitpuller gives each student a copy of the lessons by a link, and keeps what they wrote when it pulls again.
RUN pip install --no-cache-dir "jupyterhub==5.5.*" "nbgitpuller==1.*"
# A cell that takes too much memory ends with MemoryError instead of the whole container.
COPY tools/deploy/ipython_config.py /usr/local/etc/ipython/ipython_config.py

USER reader
WORKDIR /home/reader
CMD ["jupyterhub-singleuser"]
