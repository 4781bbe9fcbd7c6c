"""What the chassis measures, and what follows for its surroundings.

Read in this order: ``chassis_state`` (the newest message of each kind), ``pose_filter`` (localised pose and odometry to
one pose), ``scan_watchdog`` (whether scan and pose are good enough to move), ``observed`` (obstacles that are not on
the map), ``dynamic_obstacles`` (which of them move), ``local_costmap`` (all of it around the chassis), ``costmap`` (the
same as bytes for the topic).
"""
