# The lessons in JupyterLab, with the versions of requirements.lock:
#     docker build -t camviz . && docker run --rm -p 8888:8888 camviz
FROM python:3.12-slim-bookworm

RUN apt-get update && apt-get install --yes --no-install-recommends libcairo2 libegl1 libgl1 fonts-dejavu-core \
    && rm -rf /var/lib/apt/lists/*

WORKDIR /camviz
COPY requirements.lock .
RUN pip install --no-cache-dir --require-hashes -r requirements.lock

COPY . .
RUN pip install --no-cache-dir --no-deps --no-build-isolation --editable . && useradd --create-home reader && chown -R reader .

USER reader
ENV VTK_DEFAULT_OPENGL_WINDOW=vtkEGLRenderWindow
EXPOSE 8888
CMD ["camviz", "lab", "--", "--ip=0.0.0.0", "--no-browser"]
