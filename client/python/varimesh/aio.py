"""The client for asyncio.

Each call has a thread of its own. Hashing, files and arrays therefore do not block the event loop, and a loop can wait
for any number of jobs. Cancelling a task ends its call.
"""
from __future__ import annotations

import asyncio
import os
import threading
from collections.abc import AsyncIterator, Callable, Generator, Iterable, Iterator, Mapping
from types import TracebackType
from typing import Any, TypeVar, Unpack

import grpc

from .client import Client, MeshLike, Path, Paths
from .connection import Stop
from .job import Job, Result
from .options import Geometry, Layers, Options
from .events import Event
from .reports import CellQuality, ServerInfo

T = TypeVar("T")


async def in_thread(function: Callable[..., T], *arguments: Any, **keywords: Any) -> T:
    """Awaits a function that runs in a thread of its own. If the task is cancelled, so are the function's calls."""
    loop, stop = asyncio.get_running_loop(), Stop()
    future: asyncio.Future[T] = loop.create_future()

    def settle(set_it: Callable[[Any], None], value: Any) -> None:
        if not future.done():
            set_it(value)

    def run() -> None:
        Stop.current.stop = stop
        try:
            outcome: tuple[Callable[[Any], None], Any] = (future.set_result, function(*arguments, **keywords))
        except BaseException as error:  # noqa: BLE001
            outcome = (future.set_exception, error)
        try:
            loop.call_soon_threadsafe(settle, *outcome)
        except RuntimeError:
            pass  # the loop is closed, and nobody waits

    threading.Thread(target=run, name=f"varimesh {function.__name__}", daemon=True).start()
    try:
        return await future
    except asyncio.CancelledError:
        stop.ask()
        raise


class AsyncJob:
    """A Job whose calls to the server are awaited."""

    def __init__(self, job: Job) -> None:
        self._job = job

    def __repr__(self) -> str:
        return repr(self._job)

    @property
    def name(self) -> str:
        return self._job.name

    @property
    def state(self) -> str:
        return self._job.state

    @property
    def owner(self) -> str:
        return self._job.owner

    @property
    def labels(self) -> Mapping[str, str]:
        return self._job.labels

    async def refresh(self) -> AsyncJob:
        await in_thread(self._job.refresh)
        return self

    async def watch(self, after: int = 0) -> AsyncIterator[Event]:
        """As Job.watch()."""
        loop = asyncio.get_running_loop()
        events: asyncio.Queue[Event | None] = asyncio.Queue()

        def pump() -> None:
            for event in self._job.watch(after):
                loop.call_soon_threadsafe(events.put_nowait, event)

        task = asyncio.ensure_future(in_thread(pump))
        task.add_done_callback(lambda _: events.put_nowait(None))
        try:
            while (event := await events.get()) is not None:
                yield event
            await task
        finally:
            task.cancel()

    async def wait(self, progress: bool = False) -> AsyncJob:
        await in_thread(self._job.wait, progress)
        return self

    async def cancel(self) -> AsyncJob:
        await in_thread(self._job.cancel)
        return self

    async def delete(self) -> None:
        await in_thread(self._job.delete)

    def __await__(self) -> Generator[Any, None, Result]:
        """As `await` of a Job: waits for its end, and gives its result."""
        return self._job.__await__()

    async def result(self) -> Result:
        """As Job.result(). The result fetches meshes only when they are asked for, which blocks; fetch() avoids that."""
        return await in_thread(self._job.result)

    async def fetch(self) -> Result:
        """The result with its mesh in arrays; the job must have been submitted with the output "parts"."""

        def fetch() -> Result:
            result = self._job.result()
            result.mesh  # noqa: B018
            return result

        return await in_thread(fetch)


class AsyncClient:
    """A Client whose calls to the server are awaited. Cancelling the task that awaits optimise() cancels the job."""

    def __init__(self, address: str | None = None, token: str | None = None, *,
                 token_file: str | os.PathLike[str] | None = None, authority: Path | None = None, certificate: Path | None = None, key: Path | None = None,
                 credentials: grpc.ChannelCredentials | None = None, channel: grpc.Channel | None = None,
                 connect: float = 5.0, retry: float = 60.0) -> None:  # fmt: skip
        self._client = Client(address, token, token_file=token_file, authority=authority, certificate=certificate, key=key,
                              credentials=credentials, channel=channel, connect=connect, retry=retry)  # fmt: skip

    @classmethod
    def of(cls, client: Client) -> AsyncClient:
        """An AsyncClient that calls the server of a Client, such as that of local(), and closes it at its end."""
        made = cls.__new__(cls)
        made._client = client
        return made

    async def close(self) -> None:
        await in_thread(self._client.close)

    async def __aenter__(self) -> AsyncClient:
        return self

    async def __aexit__(self, kind: type[BaseException] | None, error: BaseException | None,
                        trace: TracebackType | None) -> None:  # fmt: skip
        await self.close()

    async def optimise(self, mesh: MeshLike, output: Paths | None = None, *, format: str | None = None,
                       progress: bool = False, on_event: Callable[[Event], object] | None = None,
                       arrays: bool | None = None, request_id: str | None = None,
                       labels: Mapping[str, str] | None = None, priority: int = 0,
                       geometry: Geometry | Path | None = None, layers: Layers | None = None,
                       keep_orders: bool = False, **options: Unpack[Options]) -> Result:  # fmt: skip
        """As Client.optimise(), but the result has its mesh already. `on_event` is called in the event loop."""
        loop = asyncio.get_running_loop()
        failures: list[BaseException] = []

        def tell(event: Event) -> None:
            if failures:
                raise failures[0]  # in the thread that waits for the job, which then cancels it
            loop.call_soon_threadsafe(call, event)

        def call(event: Event) -> None:
            assert on_event is not None
            try:
                if not failures:
                    on_event(event)
            except BaseException as error:  # noqa: BLE001
                failures.append(error)

        def optimise() -> Result:
            result = self._client.optimise(
                mesh, output, format=format, progress=progress, on_event=None if on_event is None else tell, arrays=arrays, request_id=request_id,
                labels=labels, priority=priority, geometry=geometry, layers=layers, keep_orders=keep_orders,
                **options)  # fmt: skip
            if "parts" in result.formats:
                result.mesh  # noqa: B018
            return result

        result = await in_thread(optimise)
        if failures:  # raised by the last event
            raise failures[0]
        return result

    optimize = optimise

    async def quality(self, mesh: MeshLike, output: Paths | None = None, *, lattice: int = 0, threads: int = 0,
                      diagnose: bool = False, format: str | None = None) -> CellQuality:  # fmt: skip
        """As Client.quality()."""
        return await in_thread(self._client.quality, mesh, output, lattice=lattice, threads=threads, diagnose=diagnose,
                               format=format)  # fmt: skip

    async def submit(self, mesh: MeshLike, *, outputs: Iterable[str] = (), request_id: str | None = None,
                     labels: Mapping[str, str] | None = None, priority: int = 0,
                     geometry: Geometry | Path | None = None, layers: Layers | None = None,
                     keep_orders: bool = False, **options: Unpack[Options]) -> AsyncJob:  # fmt: skip
        return AsyncJob(await in_thread(self._client.submit, mesh, outputs=outputs, request_id=request_id,
                                         labels=labels, priority=priority, geometry=geometry, layers=layers,
                                         keep_orders=keep_orders, **options))  # fmt: skip

    async def job(self, name: str) -> AsyncJob:
        return AsyncJob(await in_thread(self._client.job, name))

    async def jobs(self, states: Iterable[str] = (), labels: Mapping[str, str] | None = None) -> list[AsyncJob]:
        def everything() -> Iterator[Job]:
            return iter(list(self._client.jobs(states, labels)))

        return [AsyncJob(job) for job in await in_thread(everything)]

    async def info(self) -> ServerInfo:
        return await in_thread(self._client.info)

    async def upload(self, mesh: MeshLike) -> str:
        return await in_thread(self._client.upload, mesh)

    async def download(self, digest: str, path: str | os.PathLike[str] | None = None) -> bytes:
        return await in_thread(self._client.download, digest, path)
