"""Computation of chunks by Dask: by processes of this machine, or by a cluster with a given address."""

from __future__ import annotations

import contextlib
import logging
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from phigen.errors import PhigenError
from phigen.sweeping.chunk import make
from phigen.sweeping.store import imported

#: Number of attempts to compute a chunk. If the worker process ends unexpectedly in each attempt, the sweep stops.
TRIES = 4

#: Number of chunks that are submitted in advance for each thread of the workers.
_AHEAD = 4

#: Time limit for the first answer of a scheduler, in the notation of Dask.
PATIENCE = "10s"

#: Type of a function that is called after each chunk, with the numbers of its members and of its failed members.
Tell = Callable[[int, int], None]


class SweepError(PhigenError):
    """A sweep stopped early. The finished chunks are in its store, and the same call continues the sweep."""

    exit_code = 2


@contextlib.contextmanager
def connected(scheduler: str | None, workers: int) -> Iterator[tuple[Any, int]]:
    """Return a context that yields a Dask client, and the number of threads of its workers.

    The client belongs to the cluster at the address ``scheduler``. If ``scheduler`` is None, it belongs to a new
    cluster of ``workers`` processes of this machine, which end with the context. Raises `SweepError` if no scheduler
    answers.
    """
    distributed, dask = imported("distributed"), imported("dask")
    if scheduler is not None:
        try:
            client = distributed.Client(scheduler, timeout=PATIENCE)
        except (OSError, ValueError, TimeoutError) as error:
            raise SweepError(f"no scheduler answers at {scheduler}: {error}") from None
        with contextlib.closing(client):
            yield client, max(1, sum(client.nthreads().values()))
        return
    with (
        # A worker that dies may have held several chunks, so a chunk counts as the cause only after TRIES attempts.
        dask.config.set({"distributed.scheduler.allowed-failures": TRIES, "distributed.worker.profile.enabled": False}),
        distributed.LocalCluster(
            n_workers=workers, threads_per_worker=1, processes=True, dashboard_address=None, silence_logs=logging.ERROR
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        yield client, workers


def make_all(client: Any, slots: int, store: str, digest: str, chunks: Sequence[int], tell: Tell) -> None:
    """Compute the chunks with the numbers ``chunks`` of a store; ``slots`` is the number of threads of the workers.

    Raises `SweepError` if workers die, if the connection is lost, or if a chunk cannot be stored. Other exceptions of
    workers are raised again in this process.
    """
    distributed = imported("distributed")
    tries = dict.fromkeys(chunks, 0)
    left = iter(chunks)
    numbers: dict[str, int] = {}

    def submit(number: int) -> Any:
        tries[number] += 1
        key = f"phigen-{digest}-{number}-{tries[number]}-{id(numbers):x}"
        numbers[key] = number
        return client.submit(make, store, digest, number, key=key, pure=False)

    def following() -> list[Any]:
        number = next(left, None)
        return [] if number is None else [submit(number)]

    going = distributed.as_completed([future for _ in range(_AHEAD * slots) for future in following()])
    for future in going:
        number = numbers.pop(future.key)
        try:
            tell(*future.result())
            again = following()
        except distributed.scheduler.KilledWorker as error:
            if tries[number] >= TRIES:
                raise SweepError(
                    f"chunk {number}: {tries[number]} workers ended while they computed it; {error}"
                ) from None
            again = [submit(number)]
        except (distributed.client.FuturesCancelledError, distributed.CancelledError, distributed.comm.CommClosedError):
            raise SweepError(
                "the connection to the scheduler was lost\n  hint: repeat the command to continue where it stopped"
            ) from None
        except OSError as error:
            hint = "repeat the command to continue where it stopped"
            raise SweepError(f"chunk {number} cannot be stored: {error}\n  hint: {hint}") from error
        future.release()
        for more in again:
            going.add(more)
