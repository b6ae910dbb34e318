# The explorer in a container:
#   docker build -t stickslip .
#   docker run --rm -p 5006:5006 stickslip
# It prints an address that ends in a random token; open that with localhost in place of 0.0.0.0.

FROM python:3.12-slim AS wheel
WORKDIR /build
COPY . .
RUN pip wheel --no-cache-dir --no-deps --wheel-dir /wheels .

FROM python:3.12-slim
COPY constraints.txt /tmp/constraints.txt
COPY --from=wheel /wheels /wheels
RUN pip install --no-cache-dir --constraint /tmp/constraints.txt --find-links /wheels "stickslip[all]" \
 && rm -r /wheels /tmp/constraints.txt \
 && useradd --create-home stickslip
USER stickslip
WORKDIR /home/stickslip
EXPOSE 5006
CMD ["stickslip", "explore", "--host", "0.0.0.0", "--port", "5006", "--no-browser"]
