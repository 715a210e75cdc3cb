// A method that is fed frame by frame, in C++: dead reckoning over the stream of proto/method_stream.proto.
// It reads and writes the wire format by hand, so it needs no library:  g++ -O2 -o stream_client stream_client.cpp
//   hippodrome eval scenarios/towns/grid.yaml --method "mine=stream:./stream_client"
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <string>

static bool read_varint(uint64_t &value) {  // from standard input; false at its end
    value = 0;
    for (int shift = 0; shift < 64; shift += 7) {
        int byte = std::getchar();
        if (byte == EOF) return false;
        value |= uint64_t(byte & 0x7f) << shift;
        if (byte < 0x80) return true;
    }
    return false;
}

static std::string varint(uint64_t value) {
    std::string bytes;
    for (; value > 0x7f; value >>= 7) bytes += char((value & 0x7f) | 0x80);
    return bytes + char(value);
}

static std::string part(int field, const std::string &body) {  // a field that is a message
    return varint(field << 3 | 2) + varint(body.size()) + body;
}

static std::string number(int field, double value) {  // a field that is a double
    std::string bytes(8, '\0');
    std::memcpy(&bytes[0], &value, 8);  // the wire is little-endian, as x86 and ARM are
    return varint(field << 3 | 1) + bytes;
}

struct Field { int number = 0; uint64_t value = 0; double real = 0.0; std::string body; };

static uint64_t take_varint(const std::string &from, size_t &at) {
    uint64_t value = 0;
    for (int shift = 0; at < from.size(); shift += 7) {
        unsigned char byte = from[at++];
        value |= uint64_t(byte & 0x7f) << shift;
        if (byte < 0x80) break;
    }
    return value;
}

static bool next(const std::string &from, size_t &at, Field &field) {  // the next field of a message
    if (at >= from.size()) return false;
    uint64_t key = take_varint(from, at);
    field = Field();
    field.number = int(key >> 3);
    if ((key & 7) == 0) field.value = take_varint(from, at);
    else if ((key & 7) == 1) { std::memcpy(&field.real, &from[at], 8); at += 8; }
    else if ((key & 7) == 2) { size_t size = take_varint(from, at); field.body = from.substr(at, size); at += size; }
    else at += 4;
    return true;
}

static void answer(const std::string &message) {
    std::string framed = varint(message.size()) + message;
    std::fwrite(framed.data(), 1, framed.size(), stdout);
    std::fflush(stdout);
}

int main() {
    double x = 0.0, y = 0.0, heading = 0.0;
    for (uint64_t size; read_varint(size);) {
        std::string message(size, '\0');
        if (std::fread(&message[0], 1, size, stdin) != size) return 1;
        Field kind, field;
        for (size_t at = 0; next(message, at, kind);) {
            if (kind.number == 1) answer(part(1, varint(1 << 3) + varint(1)));  // Begin: Ready, version 1
            if (kind.number == 3) answer(part(3, ""));                          // End: Finished
            if (kind.number != 2) continue;
            double dt_s = 0.0, speed = 0.0, yaw_rate = 0.0;
            for (size_t place = 0; next(kind.body, place, field);) {  // an Observation; field 8 has the pixels
                if (field.number == 2) dt_s = field.real;
                if (field.number == 3) speed = field.real;
                if (field.number == 4) yaw_rate = field.real;
            }
            heading += yaw_rate * dt_s;
            x += speed * dt_s * std::cos(heading);
            y += speed * dt_s * std::sin(heading);
            std::string pose = number(1, x) + number(2, y) + number(3, heading);
            answer(part(2, varint(1 << 3) + varint(1) + part(2, pose)));  // Answer: known, and its pose
        }
    }
}
