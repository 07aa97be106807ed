//! Message types of ROS 2 exports: those of the package in `ros2/beadline_msgs`, and the standard ones they are made of.

const HEADER: (&str, &str) = ("std_msgs/Header", "builtin_interfaces/Time stamp\nstring frame_id\n");
const TIME: (&str, &str) = ("builtin_interfaces/Time", "int32 sec\nuint32 nanosec\n");

/// Separates the definition of a type from those of the types that it needs.
const DELIMITER: &str = "================================================================================";

/// A message type.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MessageType {
    /// `beadline_msgs/msg/Chain`
    Chain,
    /// `beadline_msgs/msg/ChainState`
    ChainState,
    /// `beadline_msgs/msg/Summary`
    Summary,
    /// `std_msgs/msg/String`
    String,
}

impl MessageType {
    /// Package, `msg` and name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Chain => "beadline_msgs/msg/Chain",
            Self::ChainState => "beadline_msgs/msg/ChainState",
            Self::Summary => "beadline_msgs/msg/Summary",
            Self::String => "std_msgs/msg/String",
        }
    }

    /// Its definition with those of the types that it needs, as the encoding `ros2msg` of MCAP wants it.
    pub fn definition(self) -> String {
        let own = match self {
            Self::Chain => include_str!("../../ros2/beadline_msgs/msg/Chain.msg"),
            Self::ChainState => include_str!("../../ros2/beadline_msgs/msg/ChainState.msg"),
            Self::Summary => include_str!("../../ros2/beadline_msgs/msg/Summary.msg"),
            Self::String => return "string data\n".to_owned(),
        };
        let needed = [HEADER, TIME].map(|(name, text)| format!("{DELIMITER}\nMSG: {name}\n{text}"));
        own.to_owned() + &needed.concat()
    }
}
