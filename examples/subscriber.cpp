// Reads the markers of `cmpdesign serve thumb.toml --port 8765` in C++, without libraries: Foxglove's
// protocol over a websocket, messages as ROS 2 writes them (CDR). POSIX, little-endian.
//     g++ -std=c++20 -o subscriber subscriber.cpp && ./subscriber 8765 /thumb/markers
#include <arpa/inet.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>

std::string take(int socket, size_t count) {
  std::string data(count, '\0');
  for (size_t have = 0; have < count;)
    if (const ssize_t got = read(socket, &data[have], count - have); got > 0)
      have += got;
    else
      std::exit(1);
  return data;
}

std::string message(int socket) {  // of one frame; a server sends no masks
  size_t size = take(socket, 2)[1] & 127;
  if (const int more = size == 126 ? 2 : size == 127 ? 8 : 0) {
    size = 0;
    for (const char byte : take(socket, more)) size = size << 8 | static_cast<uint8_t>(byte);
  }
  return take(socket, size);
}

void send_text(int socket, const std::string& text) {  // a client masks; with zeros the text stays as it is
  const std::string head{'\x81', static_cast<char>(0x80 | 126), 0, static_cast<char>(text.size()), 0, 0, 0,
                         0};
  if (write(socket, (head + text).data(), head.size() + text.size()) < 0) std::exit(1);
}
uint32_t number(const char* at) {
  uint32_t value;
  std::memcpy(&value, at, 4);
  return value;
}
size_t even(size_t place) { return (place + 3) / 4 * 4; }

int main(int count, char** words) {
  if (count != 3) return 2;
  const int socket = ::socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in address{AF_INET, htons(std::atoi(words[1])), {htonl(INADDR_LOOPBACK)}, {}};
  if (connect(socket, reinterpret_cast<sockaddr*>(&address), sizeof address) != 0) return 1;
  const std::string ask =
      "GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
      "Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n"
      "Sec-WebSocket-Protocol: foxglove.sdk.v1\r\n\r\n";
  if (write(socket, ask.data(), ask.size()) < 0) return 1;
  for (std::string answer; !answer.ends_with("\r\n\r\n");) answer += take(socket, 1);
  for (;;) {
    const std::string got = message(socket);
    if (const size_t topic = got.find('"' + std::string(words[2]) + '"');
        got[0] == '{' && topic != got.npos) {
      const std::string id = std::to_string(std::atoi(&got[got.rfind("\"id\":", topic) + 5]));
      send_text(socket, R"({"op":"subscribe","subscriptions":[{"id":1,"channelId":)" + id + "}]}");
    } else if (got[0] == 1 && number(&got[1]) == 1) {  // a message: 1, subscription, time, a PointCloud2
      const char* cloud = &got[13 + 4];  // behind the mark of the encoding, from which places count
      size_t at = even(12 + number(cloud + 8)) + 8;  // behind stamp, name, height and width
      const uint32_t markers = number(cloud + at - 4), fields = number(cloud + at);
      at += 4;
      for (uint32_t k = 0; k < fields; ++k) at = even(even(at + 4 + number(cloud + at)) + 5) + 4;
      at = even(at + 1);  // behind is_bigendian; then point_step, row_step, the size of the data
      float first[3];
      std::memcpy(first, cloud + at + 12, sizeof first);
      std::printf("%u markers of %u bytes, marker 0 at %.3f %.3f %.3f\n", markers, number(cloud + at),
                  first[0], first[1], first[2]);
      std::fflush(stdout);
    }
  }
}
