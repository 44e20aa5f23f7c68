import json, struct, sys, zlib

KINDS = {1: "about", 2: "sent", 3: "received", 4: "opened", 5: "left",
         6: "frame", 7: "note", 8: "cut", 9: "end", 10: "unplugged", 11: "plugged"}
with open(sys.argv[1], "rb") as file:
    magic, version, length, crc = struct.unpack("<8sHHI", file.read(16))
    assert magic == b"PHREC\r\n\x1a" and version == 1
    while len(head := file.read(36)) == 36:
        magic, kind, channel, seq, time_ns, length, crc, head_crc = struct.unpack("<4sHHQQIII", head)
        body = file.read(length)
        if len(body) < length or zlib.crc32(head[:32]) != head_crc or zlib.crc32(body) != crc:
            break
        what = body
        if kind == 1:
            what = json.loads(body)["name"]
        if kind == 6:
            frame_id, index, width, height, format = struct.unpack_from("<QIII4s", body, 8)
            what = f"frame {frame_id}, {width} x {height} {format.decode()}, {length - 72} bytes"
        print(seq, time_ns / 1e9, KINDS.get(kind, kind), channel, what)
