# cadmorph in a container: built and tested by the two commands of the README.
#   docker build -t cadmorph .
#   docker run --rm -v "$PWD:/data" -w /data cadmorph BASE.step VARIANT.step MESH
FROM debian:12
WORKDIR /cadmorph
COPY . .
RUN scripts/demo
RUN scripts/test
ENTRYPOINT ["/cadmorph/build/apps/cadmorph"]
