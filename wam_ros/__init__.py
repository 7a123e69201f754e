"""All ROS glue of the stack: parameters, messages, lockstep, run(), recorder, bring-up."""
