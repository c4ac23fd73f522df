#pragma once

/// The package's messages. The message Table and the core's struct of that name share a namespace,
/// which ROS derives from the package's name: here the message is called TableMessage. Include this
/// header, never tabletop_perception/Table.h or TableArray.h.

#define Table TableMessage
#define TablePtr TableMessagePtr
#define TableConstPtr TableMessageConstPtr
#include <tabletop_perception/TableArray.h>
#undef TableConstPtr
#undef TablePtr
#undef Table

#include <tabletop_perception/CandidateArray.h>
#include <tabletop_perception/EstimatePoseAt.h>
#include <tabletop_perception/GetObjectPose.h>
#include <tabletop_perception/PickedObject.h>
#include <tabletop_perception/RecognizedObjectArray.h>
