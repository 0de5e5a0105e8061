"""Pieces of work that other processes can import."""

import os
import signal
import time

import numpy as np
import scipy.linalg
import threadpoolctl


def blas_threads(data, item):
    np.linalg.norm(scipy.linalg.cholesky(np.eye(3)))  # both libraries are loaded and used
    return os.getpid(), [each["num_threads"] for each in threadpoolctl.threadpool_info()]


def square(data, item):
    time.sleep(0.02)
    return os.getpid(), data * item**2


def fall(data, item):
    if item == data:
        os.kill(os.getpid(), signal.SIGKILL)
    return item


def refuse(data, item):
    raise ValueError(f"item {item}")


def sleep(data, item):
    time.sleep(data)
    return os.getpid()


def zeros(data, item):
    return np.zeros(data)
