"""ONNX files, opened so that they can do nothing but compute.

A network is an arithmetic program: running it can cost time and memory, but it has no access to anything else.
"""

from __future__ import annotations

import os

from rlacd.errors import MissingExtraError

try:
    import onnxruntime
except ImportError as error:
    raise MissingExtraError("networks need an extra: run  pip install 'rlacd[learned]'  and try again.") from error


def open_network(content: bytes) -> onnxruntime.InferenceSession:
    """Load a network to run on one thread: components are processed in parallel already.

    External files with weights, which an ONNX file can refer to, are not read.

    Raises
    ------
    Exception
        The file is damaged; onnxruntime's exceptions have no public base class.
    """
    settings = onnxruntime.SessionOptions()
    settings.intra_op_num_threads = settings.inter_op_num_threads = 1
    settings.log_severity_level = 4
    settings.add_session_config_entry("session.model_external_initializers_file_folder_path", os.devnull)
    # Without the option a damaged file is opened twice, and the reason printed.
    return onnxruntime.InferenceSession(content, settings, providers=["CPUExecutionProvider"], enable_fallback=0)
