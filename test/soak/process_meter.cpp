#include "process_meter.h"

#include <unistd.h>

#include <fstream>
#include <limits>
#include <stdexcept>

#include <ros/master.h>
#include <ros/network.h>
#include <ros/this_node.h>
#include <xmlrpcpp/XmlRpc.h>

namespace tabletop_perception::soak {
namespace {

std::ifstream fileOf(int process, const std::string& name) {
  std::ifstream file("/proc/" + std::to_string(process) + "/" + name);
  if (!file) throw std::runtime_error("process " + std::to_string(process) + " is gone");
  return file;
}

/// User and system time until now [s].
double cpuSeconds(int process) {
  auto file = fileOf(process, "stat");
  file.ignore(std::numeric_limits<std::streamsize>::max(), ')');  // the name may hold spaces
  std::string word;
  for (int field = 3; field < 14; ++field) file >> word;
  double user = 0, system = 0;
  file >> user >> system;
  return (user + system) / static_cast<double>(sysconf(_SC_CLK_TCK));
}

}  // namespace

int processOf(const std::string& node) {
  XmlRpc::XmlRpcValue request, response, payload;
  request[0] = ros::this_node::getName();
  request[1] = node;
  if (!ros::master::execute("lookupNode", request, response, payload, false))
    throw std::runtime_error("there is no node " + node);
  std::string host;
  std::uint32_t port = 0;
  if (!ros::network::splitURI(payload, host, port))
    throw std::runtime_error("node " + node + " has no address");
  XmlRpc::XmlRpcClient client(host.c_str(), static_cast<int>(port));
  XmlRpc::XmlRpcValue me;
  me[0] = ros::this_node::getName();
  if (!client.execute("getPid", me, response) || client.isFault())
    throw std::runtime_error("node " + node + " does not answer");
  return response[2];
}

double residentMb(int process) {
  auto file = fileOf(process, "statm");
  double all = 0, resident = 0;
  file >> all >> resident;
  return resident * static_cast<double>(sysconf(_SC_PAGESIZE)) / 1e6;
}

CpuMeter::CpuMeter(int process)
    : process_(process), cpu_(cpuSeconds(process)), start_(std::chrono::steady_clock::now()) {}

double CpuMeter::share() const {
  const std::chrono::duration<double> passed = std::chrono::steady_clock::now() - start_;
  return (cpuSeconds(process_) - cpu_) / passed.count();
}

}  // namespace tabletop_perception::soak
