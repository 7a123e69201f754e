"""What touches the arm: external torques, contact positions, tracked model errors.

==========================  ================================================================================
``contact_estimator``       what touches the arm: observer, detection and inference together
``contact_estimator_node``  the node
``contact_fit``             the probability of contact positions along straight links
``contact_fusion``          several instants of one contact that explain it together
``contact_inference``       which link is touched, where and how hard
``contact_table``           hypotheses as rows of numbers, as the topic carries them, and back
``error_effects``           how the errors of the model act on the torques
``inference_parameters``    its parameters
``model_errors``            the errors of the model, tracked in free motion
``model_prior``             what is known of them before: stated, or identified
``momentum_observer``       external joint torques and their covariance
``motor_side``              samples of the motors as those of the joints, with their friction
``observer_parameters``     its parameters
``shaft_friction``          nominal friction of motors and joints, and where it is uncertain
``thresholds``              what no parameter sets: when a contact is detected, how it may move
``velocity_fit``            velocities of the motors from their angles
==========================  ================================================================================
"""
