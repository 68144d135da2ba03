"""ONNX files, opened so that they can do no more than compute.

A network is a program of sums and products: it can ask for time and memory when it runs, but for nothing else.
"""

from __future__ import annotations

import os

from rlacd.errors import MissingExtraError

try:
    import onnxruntime
except ImportError as error:
    raise MissingExtraError(
        "learned policies need an extra: run  pip install 'rlacd[learned]'  and try again."
    ) from error


def open_network(content: bytes, optimized: bool = True) -> onnxruntime.InferenceSession:
    """Make a network ready to run on one thread: several components at a time share the processors already.

    Weights in files of their own, which an ONNX file can name, are not looked for.

    Raises
    ------
    Exception
        It is damaged; onnxruntime's own exceptions have no public base.
    """
    settings = onnxruntime.SessionOptions()
    settings.intra_op_num_threads = settings.inter_op_num_threads = 1
    settings.log_severity_level = 4
    settings.add_session_config_entry("session.model_external_initializers_file_folder_path", os.devnull)
    if not optimized:
        settings.graph_optimization_level = onnxruntime.GraphOptimizationLevel.ORT_DISABLE_ALL
    return onnxruntime.InferenceSession(content, settings, providers=["CPUExecutionProvider"])
