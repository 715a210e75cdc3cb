// A driver that is fed step by step, in C++: it keeps to the lane's right-hand line, over proto/method_stream.proto.
// It reads and writes the wire format by hand, so it needs no library:  g++ -O2 -o drive_client drive_client.cpp
//   hippodrome drive scenarios/missions/rural.yaml --missions 1 --policy "keeper=exec:./drive_client"
#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <string>
#include <vector>

struct Field { int number = 0; uint64_t value = 0; double real = 0.0; std::string body; };
static bool read_varint(uint64_t &value) {  // from standard input; false at its end
    value = 0;
    for (int shift = 0, byte; shift < 64 && (byte = std::getchar()) != EOF; shift += 7) {
        value |= uint64_t(byte & 0x7f) << shift;
        if (byte < 0x80) return true;
    }
    return false;
}

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

static std::string varint(uint64_t value) {
    std::string bytes;
    for (; value > 0x7f; value >>= 7) bytes += char((value & 0x7f) | 0x80);
    return bytes + char(value);
}
static std::string part(int field, const std::string &body) { return varint(field << 3 | 2) + varint(body.size()) + body; }
static std::string number(int field, double value) {  // the wire is little-endian, as x86 and ARM are
    std::string bytes(8, '\0');
    std::memcpy(&bytes[0], &value, 8);
    return varint(field << 3 | 1) + bytes;
}

static void answer(const std::string &message) {
    std::string framed = varint(message.size()) + message;
    std::fwrite(framed.data(), 1, framed.size(), stdout);
    std::fflush(stdout);
}

static double off_m(const std::string &pixels, int width, int height, double camera_m) {  // left of the lane's middle
    std::vector<double> places;
    for (int below = 14; below < 30; below++) {  // rows below the horizon: 8 to 4 metres ahead on a flat road
        const unsigned char *row = (const unsigned char *)pixels.data() + 3 * (width * (height / 2 + below) + width / 2);
        for (int x = 0; x < width - width / 2; x++) {
            if (std::min({row[3 * x], row[3 * x + 1], row[3 * x + 2]}) <= 165) continue;  // the first white pixel
            double place = (x + 0.5) * camera_m / below;
            if (place > 0.3 && place < 3.0) places.push_back(place);
            break;
        }
    }
    if (places.size() < 4) return 0.0;
    std::sort(places.begin(), places.end());
    return 0.5 * (places[(places.size() - 1) / 2] + places[places.size() / 2]) - 1.4;
}

int main() {
    double steering = 0.0, camera_m = 1.4;
    for (uint64_t size; read_varint(size);) {
        std::string message(size, '\0');
        if (std::fread(&message[0], 1, size, stdin) != size) return 1;
        Field kind, f, g, seen[11];
        for (size_t at = 0; next(message, at, kind);) {
            if (kind.number == 1) {  // Begin: field 3 is the camera, whose field 6 is its height; Ready is version 1
                for (size_t i = 0; next(kind.body, i, f);)
                    for (size_t j = 0; f.number == 3 && next(f.body, j, g);) if (g.number == 6) camera_m = g.real;
                answer(part(1, varint(1 << 3) + varint(1)));
            } else if (kind.number == 2) {  // Observation: 3 speed, 5 width, 6 height, 8 pixels, 10 radar: 1 gap, 4 lamp
                for (size_t i = 0; next(kind.body, i, f);) if (f.number < 11) seen[f.number] = f;
                if (seen[5].value) steering = -5.4 * off_m(seen[8].body, int(seen[5].value), int(seen[6].value), camera_m) / 36.0;
                bool waits = true;  // a gap that is not sent is 0
                for (size_t i = 0; next(seen[10].body, i, f);)
                    waits = f.number == 1 ? f.real < 8.0 : waits || (f.number == 4 && f.value > 1) || f.number == 5;
                double acceleration = waits ? -3.0 : std::min(std::max(2.0 * (1.6 - seen[3].real), -1.0), 1.0);
                answer(part(4, number(1, acceleration) + number(2, steering)));  // Command
            } else answer(part(3, ""));  // End: Finished
        }
    }
}
