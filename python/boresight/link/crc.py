"""CRC-32C (RFC 3720) of buffers, with NumPy."""
from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt


def _byte_table() -> npt.NDArray[np.uint32]:
    crc = np.arange(256, dtype=np.uint32)
    for _ in range(8):
        crc = np.where(crc & 1, (crc >> 1) ^ np.uint32(0x82F63B78), crc >> 1).astype(np.uint32)
    return crc


_BYTE = _byte_table()
_BYTE_LIST = [int(x) for x in _BYTE]
_WORD = (_BYTE[(_BYTE[np.arange(65536) & 255] ^ (np.arange(65536) >> 8)) & 255] ^
         (_BYTE[np.arange(65536) & 255] >> 8)).astype(np.uint32)


def _multiply(a: int, b: int) -> int:
    """Product of two polynomials modulo the CRC polynomial; bit 31 is the coefficient of x^0."""
    product = 0
    for bit in range(31, -1, -1):
        if a >> bit & 1:
            product ^= b
        b = (b >> 1) ^ (0x82F63B78 if b & 1 else 0)
    return product


def _zeros(count: int) -> int:
    """Effect of `count` zero bytes on the CRC register: x^(8 count)."""
    power, square = 0x80000000, 0x00800000
    while count:
        if count & 1:
            power = _multiply(power, square)
        square = _multiply(square, square)
        count >>= 1
    return power


def crc32c(data: Any) -> int:
    """CRC-32C (RFC 3720) of bytes or any buffer: b"123456789" gives 0xE3069283."""
    data = np.frombuffer(data, np.uint8)
    crc, start = 0xFFFFFFFF, 0
    if data.size >= 2048:
        # parallel lanes with one register each, then combined pairwise
        lanes = 1 << max(4, (data.size.bit_length() - 1) // 2)
        length = data.size // lanes // 2 * 2
        start = lanes * length
        words = np.ascontiguousarray(data[:start].reshape(lanes, length).view("<u2").T)
        register = np.zeros(lanes, np.uint32)
        register[0] = 0xFFFFFFFF
        for row in words:
            register = _WORD[(register ^ row) & 0xFFFF] ^ (register >> 16)
        shift = _zeros(length)
        while register.size > 1:
            left, moved, power = register[0::2], np.zeros(register.size // 2, np.uint32), shift
            for bit in range(31, -1, -1):
                moved ^= np.where(left >> np.uint32(bit) & 1, np.uint32(power), np.uint32(0))
                power = (power >> 1) ^ (0x82F63B78 if power & 1 else 0)
            register = moved ^ register[1::2]
            shift = _multiply(shift, shift)
        crc = int(register[0])
    for byte in data[start:].tolist():
        crc = _BYTE_LIST[(crc ^ byte) & 255] ^ (crc >> 8)
    return crc ^ 0xFFFFFFFF
