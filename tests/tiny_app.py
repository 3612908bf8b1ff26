"""Work of an app that tests order: a module of its own, as the process that does it imports it before it answers."""

import os
import time

from harmolab.lab.app import Order, Teller, Work


def placed() -> Work:
    """Work that finds each dance at 3 s of its song, by its movement; "fit" says which place it was told."""

    def work(order: Order, teller: Teller) -> None:
        teller.lines([f"{order.offset} {order.has_start}"], offset=order.offset or 3.0, has_start=False)

    return work


def echo() -> Work:
    """Work that is done at once: "judge" says the names of its files, "fit" fails, "dance" breaks off."""

    def work(order: Order, teller: Teller) -> None:
        if order.task == "fit":
            raise ValueError(f"{order.dance}: cannot be read")
        if order.task == "dance":
            os._exit(1)
        words = f"{order.dance.name if order.dance else 'nothing'} {order.style} {order.offset}"
        words += f" {order.how}" if order.how else ""
        teller.lines([words, "more"], offset=order.offset)
        (order.folder / "why.html").write_text("because")
        teller.view("page", order.folder / "why.html", "Why")
        if order.style == "waltz":
            time.sleep(600)

    return work
