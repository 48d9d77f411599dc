# docker build -t rotfem . && docker run --rm -v "$PWD":/work -w /work rotfem run demos/spin_up.toml
# Not tested by .ci/run: containers cannot be run there.
FROM dolfinx/dolfinx:v0.9.0
RUN apt-get update && apt-get install -y --no-install-recommends libgl1 libegl1 libxrender1 && rm -rf /var/lib/apt/lists/*
COPY . /opt/rotfem
RUN pip install --no-cache-dir "/opt/rotfem[plots,frames,report]"
ENV OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 PYVISTA_OFF_SCREEN=true
ENTRYPOINT ["rotfem"]
